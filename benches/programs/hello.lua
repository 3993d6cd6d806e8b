-- hello: what it costs to start, print one line and end.

print("hello")
