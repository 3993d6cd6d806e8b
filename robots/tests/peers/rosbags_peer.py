"""Compares messages of ROS 2 with rosbags, an implementation in Python.

    rosbags_peer.py FOLDER

reads from FOLDER:
    definitions.txt  a line `=== NAME` and the lines of a definition, for each type
    theirs.txt       lines `NAME PAYLOAD`, payloads in hexadecimal, made by others
and writes there:
    hashes.txt       lines `NAME HASH`, of all types
    read.txt         for each line of theirs.txt the payload that rosbags makes of what it has read, and what it has read
    ours.txt         lines `NAME PAYLOAD TEXT`, of random messages
"""

import math
import random
import struct
import sys

import numpy
from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

MESSAGES = 10_000
WHOLE = {"int8": (8, 1), "int16": (16, 1), "int32": (32, 1), "int64": (64, 1), "uint8": (8, 0), "byte": (8, 1),
         "octet": (8, 1), "char": (8, 0), "uint16": (16, 0), "uint32": (32, 0), "uint64": (64, 0)}


def known(name):
    """rosbags has messages only: parts of services and actions are messages to it."""
    return name.replace("/srv/", "/msg/").replace("/action/", "/msg/")


def text_of_scalar(kind, value):
    if kind == "string":
        return "s" + value.encode().hex()
    if kind == "bool":
        return "T" if value else "F"
    if kind.startswith("float"):
        return "f" + struct.pack(">d", float(value)).hex()
    # rosbags takes a single byte for a signed number.
    return str(int(value) & 255 if kind in ("byte", "octet") else int(value))


def text_of(store, description, value):
    node, of = description
    if node == Nodetype.BASE:
        return text_of_scalar(of[0], value)
    if node == Nodetype.NAME:
        fields = store.fielddefs[of][1]
        return "{" + " ".join(text_of(store, kind, getattr(value, name)) for name, kind in fields if not is_hidden(name)) + "}"
    return "[" + " ".join(text_of(store, of[0], item) for item in value) + "]"


def is_hidden(name):
    return name == "structure_needs_at_least_one_member"


def random_scalar(kind, bound):
    if kind == "string":
        most = min(bound or 12, 12)
        letters = "".join(random.choice("aZ09 _/\u00e9\u20ac\U0001f916") for _ in range(random.randrange(most + 1)))
        while len(letters.encode()) > most:
            letters = letters[:-1]
        return letters
    if kind == "bool":
        return random.random() < 0.5
    if kind == "float32":
        return float(numpy.float32(random.choice([0.0, -0.0, math.inf, -math.inf, 1e-40, random.gauss(0, 1e6)])))
    if kind == "float64":
        return random.choice([0.0, -0.0, math.inf, -math.inf, 5e-324, random.gauss(0, 1), random.gauss(0, 1e300)])
    bits, sign = WHOLE[kind]
    low, high = (-(1 << bits - 1), (1 << bits - 1) - 1) if sign else (0, (1 << bits) - 1)
    return random.choice([low, high, 0, random.randint(low, high)])


def random_value(store, description, depth):
    node, of = description
    if node == Nodetype.BASE:
        return random_scalar(*of)
    if node == Nodetype.NAME:
        values = {name: 0 if is_hidden(name) else random_value(store, kind, depth + 1)
                  for name, kind in store.fielddefs[of][1]}
        return store.types[of](**values)
    item, size = of
    if node == Nodetype.SEQUENCE:
        most = random.choice([0, 1, 2, 5]) if depth < 3 else 1
        size = random.randrange(min(size or most, most) + 1)
    items = [random_value(store, item, depth + 1) for _ in range(size)]
    if item[0] == Nodetype.BASE and item[1][0] != "string":
        kind = {"byte": "uint8", "octet": "uint8", "char": "uint8"}.get(item[1][0], item[1][0])
        return numpy.array([item & 255 for item in items] if kind == "uint8" else items, dtype=kind)
    return items


def main():
    folder = sys.argv[1]
    texts = {}
    with open(f"{folder}/definitions.txt", encoding="utf-8") as file:
        for line in file:
            if line.startswith("=== "):
                name = line[4:].strip()
                texts[name] = ""
            else:
                texts[name] += line
    store = get_typestore(Stores.EMPTY)
    types = {}
    for name, text in texts.items():
        # To ROS 2 `char` is another name of `uint8`; rosbags makes a type of its own of it.
        text = "\n".join(line.replace("char", "uint8", 1) if line.startswith("char") else line for line in text.splitlines())
        types.update(get_types_from_msg(text + "\n", known(name)))
    store.register({name: kind for name, kind in types.items() if name not in store.fielddefs})
    names = sorted(texts)
    with open(f"{folder}/hashes.txt", "w", encoding="utf-8") as file:
        for name in names:
            if "/msg/" in name:
                file.write(f"{name} {store.hash_rihs01(name)}\n")
    with open(f"{folder}/theirs.txt", encoding="utf-8") as given, open(f"{folder}/read.txt", "w", encoding="utf-8") as file:
        for line in given:
            name, payload = line.split()
            message = store.deserialize_cdr(bytes.fromhex(payload), known(name))
            again = bytes(store.serialize_cdr(message, known(name))).hex()
            file.write(f"{again} {text_of(store, (Nodetype.NAME, known(name)), message)}\n")
    random.seed(7)
    with open(f"{folder}/ours.txt", "w", encoding="utf-8") as file:
        for number in range(MESSAGES):
            name = names[number % len(names)]
            description = (Nodetype.NAME, known(name))
            message = random_value(store, description, 0)
            payload = bytes(store.serialize_cdr(message, known(name))).hex()
            file.write(f"{name} {payload} {text_of(store, description, message)}\n")


main()
