"""A robot that speaks the protocol of rosbridge, version 2: `serve` by the package `websockets`, and `ask PORT`, a
client by `roslibpy`. Both print what they have heard."""

import asyncio
import json
import sys


async def converse(connection):
    async for text in connection:
        message = json.loads(text)
        match message["op"]:
            case "subscribe":
                print("subscribe", message["topic"], message["type"], flush=True)
                for percentage in [0.9, 0.8]:
                    answer = {"op": "publish", "topic": message["topic"], "msg": {"percentage": percentage}}
                    await connection.send(json.dumps(answer))
            case "advertise":
                print("advertise", message["topic"], message["type"], flush=True)
            case "publish":
                print("publish", message["topic"], json.dumps(message["msg"]), flush=True)
            case "call_service":
                print("call", message["service"], json.dumps(message["args"]), flush=True)
                is_known = message["service"] == "/dock"
                values = {"station": message["args"]["station"], "docked": True} if is_known else "no such service"
                answer = {"op": "service_response", "service": message["service"], "values": values}
                await connection.send(json.dumps(answer | {"id": message["id"], "result": is_known}))


async def run_server():
    from websockets.asyncio.server import serve

    async with serve(converse, "127.0.0.1", 0) as server:
        print(server.sockets[0].getsockname()[1], flush=True)
        await asyncio.get_running_loop().create_future()


def ask(port):
    import threading

    import roslibpy

    ros = roslibpy.Ros("127.0.0.1", port)
    ros.run(timeout=20)
    heard = threading.Event()
    topic = roslibpy.Topic(ros, "/state", "std_msgs/String")

    def hear(message):
        print("heard", message["data"], flush=True)
        heard.set()

    topic.subscribe(hear)
    heard.wait(20)
    service = roslibpy.Service(ros, "/drive", "my_msgs/Drive")
    print("result", service.call(roslibpy.ServiceRequest({"metres": 3}), timeout=20)["driven"], flush=True)
    try:
        service.call(roslibpy.ServiceRequest({"metres": 1000}), timeout=20)
    except roslibpy.core.ServiceException as error:
        print("failed", error, flush=True)
    orders = roslibpy.Topic(ros, "/orders", "std_msgs/String")
    orders.advertise()
    orders.publish(roslibpy.Message({"data": "halt"}))
    heard.clear()
    heard.wait(20)
    ros.terminate()


if sys.argv[1] == "serve":
    asyncio.run(run_server())
else:
    ask(int(sys.argv[2]))
