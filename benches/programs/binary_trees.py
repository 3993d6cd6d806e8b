# binary_trees: allocating small objects, most of them short-lived, and collecting them.


def make_tree(depth):
    if depth == 0:
        return (None, None)
    return (make_tree(depth - 1), make_tree(depth - 1))


def count_nodes(tree):
    left, right = tree
    if left:
        return 1 + count_nodes(left) + count_nodes(right)
    return 1


def binary_trees(max_depth):
    long_lived = make_tree(max_depth)
    for depth in range(4, max_depth + 1, 2):
        trees = 1 << (max_depth - depth)
        nodes = 0
        for _ in range(trees):
            nodes += count_nodes(make_tree(depth))
        print(f"{trees} trees of depth {depth}: {nodes}")
    print(f"long-lived: {count_nodes(long_lived)}")


binary_trees(18)
