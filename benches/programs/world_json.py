"""world_json: fifty thousand lines of JSON, 10 MB, read into dictionaries and lists."""
import json

line = '{"time": 12.5, "attitude": "turning", "battery": 68, "wheels": [1.25, -3.5, 0.125, 2.75], "status": {"mode": "nominal", "faults": [], "is_safe": false, "link": null}, "note": "all systems are nominal so far"}'
total = 0
for _ in range(50000):
    total += json.loads(line)["battery"]
print(total)
