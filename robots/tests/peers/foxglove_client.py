"""A client of Foxglove's protocol: `foxglove_client.py PORT TOPIC…` subscribes to topics as they are advertised, and
prints their channels and messages."""

import asyncio
import json
import struct
import sys

import websockets


async def main(port, topics):
    url = f"ws://127.0.0.1:{port}"
    async with websockets.connect(url, subprotocols=["foxglove.sdk.v1"], max_size=None) as socket:
        print("protocol", socket.subprotocol, flush=True)
        channels = {}
        async for message in socket:
            if isinstance(message, str):
                told = json.loads(message)
                if told["op"] == "serverInfo":
                    print("server", told["name"], flush=True)
                elif told["op"] == "advertise":
                    await subscribe(socket, told["channels"], topics, channels)
            elif message[0] == 1:
                number, time = struct.unpack_from("<IQ", message, 1)
                print("message", channels[number], time, message[13:].decode(), flush=True)


async def subscribe(socket, advertised, topics, channels):
    wanted = []
    for channel in advertised:
        if channel["topic"] in topics:
            number = len(channels)
            channels[number] = channel["topic"]
            wanted.append({"id": number, "channelId": channel["id"]})
            print("channel", channel["topic"], channel["encoding"], channel["schemaName"], flush=True)
    if wanted:
        await socket.send(json.dumps({"op": "subscribe", "subscriptions": wanted}))


if __name__ == "__main__":
    try:
        asyncio.run(main(sys.argv[1], sys.argv[2:]))
    except websockets.ConnectionClosed:
        pass
    print("closed", flush=True)
