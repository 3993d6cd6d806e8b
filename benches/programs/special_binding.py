# special_binding: binding global variables around calls, and reading them further down.

depth = 0
path = 1
checksum = 0


def visit():
    global checksum
    checksum = (checksum * 3 + path) % 1000003


def walk(levels):
    global depth, path
    visit()
    if depth < levels:
        saved_depth = depth
        saved_path = path
        depth += 1
        try:
            path = path * 2 % 1000003
            try:
                walk(levels)
            finally:
                path = saved_path
            path = (path * 2 + 1) % 1000003
            try:
                walk(levels)
            finally:
                path = saved_path
        finally:
            depth = saved_depth


for i in range(2):
    walk(20 + i)
print(depth, path, checksum)
