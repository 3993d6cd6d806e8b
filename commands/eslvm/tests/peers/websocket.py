"""Peers by the package `websockets`: `serve [CERTIFICATE KEY]` is a server, which prints its port; `talk URL` is a client
of an echo, which prints what it has found; `secured URL AUTHORITY` is one by TLS."""

import asyncio
import ssl
import sys

import websockets
from websockets.asyncio.client import connect
from websockets.asyncio.server import serve


async def answer(connection):
    path = connection.request.path
    if path == "/echo":
        async for message in connection:
            await connection.send(message)
    elif path == "/parts":
        await connection.send(["ein", "s, z", "wei"])
        await connection.send([b"\x01", b"\x02\x03"])
        await connection.send("x" * 1_000_000)
        await connection.wait_closed()
    elif path == "/ping":
        pong = await connection.ping(b"there?")
        await connection.send(f"{await pong < 10}")
        await connection.wait_closed()
    elif path == "/close":
        await connection.close(4321, "genug")
    elif path == "/fails":
        raise ValueError("it fails")
    elif path == "/code":
        await connection.wait_closed()
        print("closed", connection.close_code, connection.close_reason, flush=True)
    elif path == "/slow":
        # It reads nothing for a while.
        await asyncio.sleep(1)
        count = 0
        async for message in connection:
            count += len(message)
            if count == 20 * 200_000:
                await connection.send(str(count))
    elif path == "/headers":
        await connection.send(
            f"{connection.request.headers['X-Robot']} {connection.request.headers.get('Sec-WebSocket-Extensions')} "
            f"{connection.subprotocol}"
        )


async def run_server():
    options = {"subprotocols": ["v2", "v1"], "select_subprotocol": lambda _, offered: offered[0] if offered else None}
    if len(sys.argv) > 2:
        options["ssl"] = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
        options["ssl"].load_cert_chain(sys.argv[2], sys.argv[3])
    async with serve(answer, "127.0.0.1", 0, **options) as server:
        print(server.sockets[0].getsockname()[1], flush=True)
        await asyncio.get_running_loop().create_future()


async def talk(url):
    # It offers compression, which is not taken.
    async with connect(url + "/echo", subprotocols=["v9", "v1"], ping_interval=0.05, ping_timeout=5) as connection:
        print("protocol", connection.subprotocol, "extensions", connection.protocol.extensions)
        for message in ["grüß dich", "", b"\x00\xff", "ü" * 500_000, bytes(300_000)]:
            await connection.send(message)
            print(await connection.recv() == message)
        await connection.send(["in ", "drei ", "Teilen"])
        print(await connection.recv())
        print(await (await connection.ping()) < 10)
        many = [str(number) for number in range(2000)]

        async def send():
            for message in many:
                await connection.send(message)

        sending = asyncio.create_task(send())
        print([await connection.recv() for _ in many] == many)
        await sending
        # The keep-alive has its turn.
        await asyncio.sleep(0.3)
        await connection.close(3999, "fertig")
        print("closed", connection.close_code, connection.close_reason)
    for path, close in [("/closes", None), ("/fails", None), ("/ends", (1001, "bye"))]:
        async with connect(url + path) as connection:
            if close:
                await connection.close(*close)
            try:
                await connection.recv()
            except websockets.ConnectionClosed as closed:
                print(path, closed.rcvd.code if closed.rcvd else None, closed.rcvd.reason if closed.rcvd else None)
    try:
        async with connect(url + "/none"):
            pass
    except websockets.InvalidStatus as refused:
        print("refused", refused.response.status_code)


async def talk_secured(url, authority):
    async with connect(url + "/echo", ssl=ssl.create_default_context(cafile=authority)) as connection:
        for message in ["grüß dich", bytes(300_000)]:
            await connection.send(message)
            print(await connection.recv() == message)
    try:
        async with connect(url + "/echo", ssl=ssl.create_default_context()):
            pass
    except ssl.SSLCertVerificationError as refused:
        print(refused.reason)


if sys.argv[1] == "serve":
    asyncio.run(run_server())
elif sys.argv[1] == "secured":
    asyncio.run(talk_secured(*sys.argv[2:4]))
else:
    asyncio.run(talk(sys.argv[2]))
