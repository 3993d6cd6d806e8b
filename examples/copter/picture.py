"""Draws the path of a flight: python picture.py TRACE > flight.svg, of a file by copter.py --trace."""

import json
import sys

SCALE, LEFT, TOP = 16, 60, 40
COLOURS = {"GUIDED": "#1f6fb4", "RTL": "#c1542b", "STABILIZE": "#888888"}

trace = json.load(open(sys.argv[1]))
places = [step for step in trace if "at" in step]
pictures = [step["picture"] for step in trace if "picture" in step]
seconds = len(places) / 5


def point(north, east):
    return LEFT + 60 + SCALE * east, TOP + 20 + SCALE * (22 - north)


def time_point(index, up):
    return LEFT + 520 * index / len(places), TOP + 640 - 10 * up


def runs():
    """Returns the parts of the path with the same mode and radio."""
    parts, before = [], None
    for index, step in enumerate(places):
        key = (step["mode"], step["cut"])
        if key != before:
            parts.append((key, [index - 1] if index else []))
            before = key
        parts[-1][1].append(index)
    return parts


def line(points, mode, is_cut):
    path = " ".join(f"{x:.1f},{y:.1f}" for x, y in points)
    dash = ' stroke-dasharray="4 3"' if is_cut else ""
    return f'<polyline points="{path}" fill="none" stroke="{COLOURS.get(mode, "#888888")}" stroke-width="2"{dash}/>'


def text(x, y, words, anchor="start"):
    return f'<text x="{x}" y="{y}" text-anchor="{anchor}">{words}</text>'


print('<svg xmlns="http://www.w3.org/2000/svg" width="640" height="740" font-family="sans-serif" font-size="13">')
print('<rect width="640" height="740" fill="white"/>')
print(text(LEFT, 24, "Seen from above: north is up, a circle is a picture"))
for north in range(0, 21, 10):
    x, y = point(north, -2.6)
    print(text(x, y + 4, f"{north} m", "end"))
    print(f'<line x1="{x + 6}" y1="{y}" x2="{point(0, 23)[0]}" y2="{y}" stroke="#dddddd"/>')
for (mode, is_cut), indices in runs():
    print(line([point(*places[index]["at"][:2]) for index in indices], mode, is_cut))
for place in pictures:
    x, y = point(*place)
    print(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="6" fill="none" stroke="#222222"/>')
x, y = point(0, 0)
print(f'<rect x="{x - 4}" y="{y - 4}" width="8" height="8" fill="#222222"/>')
print(text(x + 10, y + 16, "home"))
print(text(LEFT, TOP + 450, "Height over time"))
for up in (0, 10):
    y = time_point(0, up)[1]
    print(text(LEFT - 6, y + 4, f"{up} m", "end"))
    print(f'<line x1="{LEFT}" y1="{y}" x2="{LEFT + 520}" y2="{y}" stroke="#dddddd"/>')
for (mode, is_cut), indices in runs():
    print(line([time_point(index, places[index]["at"][2]) for index in indices], mode, is_cut))
print(text(LEFT + 520, TOP + 662, f"{seconds:.0f} s", "end"))
for place, (mode, words) in enumerate([("GUIDED", "mode guided"), ("RTL", "mode rtl"), (None, "dashed: the link is cut")]):
    print(f'<g fill="{COLOURS.get(mode, "#222222")}">{text(LEFT + 150 * place, TOP + 685, words)}</g>')
print("</svg>")
