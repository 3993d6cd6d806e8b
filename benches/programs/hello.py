# hello: the cost of starting, printing one line and ending.

print("hello")
