-- planner: breadth-first search for a plan that builds another tower of the same blocks.
--
-- A state is a table: for each block, the block below it, or 0 for the table.

local BLOCKS = 7

local function key(below)
  local key = 0
  for i = 1, BLOCKS do
    key = key * (BLOCKS + 1) + below[i]
  end
  return key
end

local function is_clear(block, below)
  for other = 1, BLOCKS do
    if below[other] == block then
      return false
    end
  end
  return true
end

local function tower(blocks)
  local below, last = {}, 0
  for _, block in ipairs(blocks) do
    below[block] = last
    last = block
  end
  return below
end

local function copy(below)
  local result = {}
  for i = 1, BLOCKS do
    result[i] = below[i]
  end
  return result
end

-- Returns the nodes that one move leads to and that `seen` does not have, newest first, and adds them to it.
local function successors(node, seen)
  local found = nil
  local below = node.below
  for block = 1, BLOCKS do
    if is_clear(block, below) then
      for target = 0, BLOCKS do
        if target ~= block and target ~= below[block] and (target == 0 or is_clear(target, below)) then
          local next = copy(below)
          next[block] = target
          local k = key(next)
          if not seen[k] then
            seen[k] = true
            found = { first = { below = next, from = node, move = 10 * block + target }, rest = found }
          end
        end
      end
    end
  end
  return found
end

local function plan(start, goal)
  local seen = {}
  local goal_key = key(goal)
  local frontier = { { below = start } }
  local count = 1
  seen[key(start)] = true
  while true do
    local next = {}
    for _, node in ipairs(frontier) do
      if key(node.below) == goal_key then
        local moves = {}
        while node.from do
          table.insert(moves, 1, node.move)
          node = node.from
        end
        return moves, count
      end
      local found = successors(node, seen)
      while found do
        count = count + 1
        next[#next + 1] = found.first
        found = found.rest
      end
    end
    frontier = next
  end
end

local moves, count = plan(tower({ 1, 2, 3, 4, 5, 6, 7 }), tower({ 2, 4, 1, 6, 3, 7, 5 }))
print(string.format("%d moves, %d states", #moves, count))
local line = {}
for _, move in ipairs(moves) do
  line[#line + 1] = move .. " "
end
print(table.concat(line))
