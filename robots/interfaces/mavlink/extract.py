"""Extracts what ESL needs of the XML definitions of MAVLink: `python3 extract.py FOLDER > definitions.txt`.

FOLDER has ardupilotmega.xml and the files that it includes, as in `mavlink/message_definitions/v1.0` of the crate
mavlink. The definitions are under the MIT licence. The lines of the result:

    enum NAME | bits NAME              then, indented: VALUE NAME
    message NUMBER NAME                then, indented: TYPE NAME [ENUM], and `extensions` before extension fields
    command NUMBER NAME                then, indented: INDEX LABEL [ENUM] [=DEFAULT]; a label `-` has no name
"""

import re
import sys
import xml.etree.ElementTree as ElementTree
from pathlib import Path

folder = Path(sys.argv[1])
files, enums, messages, bits = [], {}, {}, set()


def read(name):
    if name in files:
        return
    files.append(name)
    root = ElementTree.parse(folder / name).getroot()
    for include in root.findall("include"):
        read(include.text.strip())
    for enum in root.findall("enums/enum"):
        entries = enums.setdefault(enum.get("name"), [])
        if enum.get("bitmask") == "true":
            bits.add(enum.get("name"))
        value = entries[-1][0] if entries else -1
        for entry in enum.findall("entry"):
            text = entry.get("value")
            if text is None:
                value += 1
            elif "**" in text:
                base, exponent = text.split("**")
                value = int(base) ** int(exponent)
            else:
                value = int(text, 0)
            entries.append((value, entry.get("name"), entry.findall("param")))
    for message in root.findall("messages/message"):
        fields = []
        for part in message:
            if part.tag == "extensions":
                fields.append("extensions")
            elif part.tag == "field":
                line = f"{part.get('type')} {part.get('name')}"
                fields.append(f"{line} {part.get('enum')}" if part.get("enum") else line)
        messages[int(message.get("id"))] = (message.get("name"), fields)


def label(param):
    text = param.get("label")
    text = re.sub(r"([a-z0-9])([A-Z])", r"\1-\2", text) if text else ""
    text = re.sub(r"[^a-z0-9]+", "-", text.lower()).strip("-")
    return text if text and param.get("reserved") != "true" else "-"


read("ardupilotmega.xml")
for name in sorted(enums):
    print(f"{'bits' if name in bits else 'enum'} {name}")
    for value, entry, _ in enums[name]:
        print(f" {value} {entry}")
for number in sorted(messages):
    name, fields = messages[number]
    print(f"message {number} {name}")
    for field in fields:
        print(f" {field}")
for value, name, params in sorted(enums["MAV_CMD"], key=lambda entry: entry[0]):
    print(f"command {value} {name}")
    for param in params:
        line = f" {param.get('index')} {label(param)}"
        if param.get("enum") and label(param) != "-":
            line += f" {param.get('enum')}"
        if param.get("default"):
            line += f" ={param.get('default')}"
        if line != f" {param.get('index')} -":
            print(line)
