"""A server that answers handshakes of WebSocket and then sends bytes by the path, most of them wrong. It needs no
packages. It prints its port."""

import base64
import hashlib
import socket
import sys
import threading

GUID = b"258EAFA5-E914-47DA-95CA-C5AB0DC85B11"


def frame(first, payload):
    return bytes([first, len(payload)]) + payload


# What is sent behind the handshake, by the path of the request.
SENT = {
    "/masked": bytes([0x81, 0x82, 0, 0, 0, 0]) + b"hi",
    "/reserved": frame(0xC1, b"hi"),
    "/kind": frame(0x83, b"hi"),
    "/text": frame(0x81, b"\xff"),
    "/cut-text": frame(0x81, b"\xc3"),
    "/part": frame(0x80, b"hi"),
    "/long": bytes([0x82, 127]) + (1 << 40).to_bytes(8, "big"),
    "/long-control": bytes([0x89, 126, 0, 126]) + bytes(126),
    "/garbage": bytes(range(0x30, 0x60)) * 100,
    "/reset": frame(0x81, b"last"),
    "/close": frame(0x88, (1012).to_bytes(2, "big") + "später".encode()),
    "/no-code": frame(0x88, b""),
    "/parts": frame(0x01, b"\xc3") + frame(0x89, b"") + frame(0x80, b"\xbc"),
    "/silent": frame(0x81, b"hi"),
    "/cut": bytes([0x81, 100]) + b"hi",
}
# Those that end the connection.
ENDS = {"/reset", "/cut"}
# Answers to the handshake itself.
ANSWERS = {
    "/key": "HTTP/1.1 101 Switching\r\nUpgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Accept: no\r\n\r\n",
    "/no-upgrade": "HTTP/1.1 101 Switching\r\nUpgrade: h2c\r\nConnection: Upgrade\r\nSec-WebSocket-Accept: KEY\r\n\r\n",
    "/extension": "HTTP/1.1 101 Switching\r\nUpgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Accept: KEY\r\n"
    "Sec-WebSocket-Extensions: permessage-deflate\r\n\r\n",
    "/protocol": "HTTP/1.1 101 Switching\r\nUpgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Accept: KEY\r\n"
    "Sec-WebSocket-Protocol: other\r\n\r\n",
    "/forbidden": "HTTP/1.1 403 Forbidden\r\nContent-Length: 0\r\n\r\n",
    "/page": "HTTP/1.1 200 OK\r\nContent-Length: 2\r\n\r\nhi",
    "/not-http": "220 mail.example ESMTP\r\n\r\n",
}
RIGHT = "HTTP/1.1 101 Switching\r\nUpgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Accept: KEY\r\n\r\n"


def converse(connection):
    head = b""
    while not head.endswith(b"\r\n\r\n"):
        piece = connection.recv(1)
        if not piece:
            return
        head += piece
    path = head.split()[1].decode()
    lines = head.decode().split("\r\n")
    key = next((line.split(": ")[1] for line in lines if line.lower().startswith("sec-websocket-key: ")), "")
    accept = base64.b64encode(hashlib.sha1(key.encode() + GUID).digest()).decode()
    connection.sendall(ANSWERS.get(path, RIGHT).replace("KEY", accept).encode())
    if path == "/floods":
        # Pings whose pongs are not read.
        while True:
            connection.sendall(frame(0x89, bytes(125)) * 1000)
    connection.sendall(SENT.get(path, b""))
    if path not in ENDS:
        received = b""
        while piece := connection.recv(4096):
            received += piece
        # The code by which the program closes: the mask is on the last bytes.
        print(path, "closed", flush=True)
    connection.close()


def guarded(connection):
    try:
        converse(connection)
    except OSError:
        pass


listener = socket.create_server(("127.0.0.1", 0))
print(listener.getsockname()[1], flush=True)
while True:
    threading.Thread(target=guarded, args=(listener.accept()[0],), daemon=True).start()
