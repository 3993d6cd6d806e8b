-- binary_trees: allocating small objects, most of them short-lived, and collecting them.

local function make_tree(depth)
  if depth == 0 then
    return {}
  end
  return { make_tree(depth - 1), make_tree(depth - 1) }
end

local function count_nodes(tree)
  if tree[1] then
    return 1 + count_nodes(tree[1]) + count_nodes(tree[2])
  end
  return 1
end

local function binary_trees(max_depth)
  local long_lived = make_tree(max_depth)
  local trees = 2 ^ (max_depth - 4)
  for depth = 4, max_depth, 2 do
    local nodes = 0
    for _ = 1, trees do
      nodes = nodes + count_nodes(make_tree(depth))
    end
    print(string.format("%d trees of depth %d: %d", trees, depth, nodes))
    trees = trees / 4
  end
  print(string.format("long-lived: %d", count_nodes(long_lived)))
end

binary_trees(18)
