-- behaviour_tree: ten thousand nodes, ticked many times; each is a function that returns a status.

local floor = math.floor
local seed = 42

local function next_random(limit)
  seed = (seed * 16807) % 2147483647
  return seed % limit
end

local clock, ticks = 0, 0

local function make_condition_node(period)
  return function()
    ticks = ticks + 1
    return clock % period < floor(period / 2) and "success" or "failure"
  end
end

local function make_action_node(duration)
  local left = duration
  return function()
    ticks = ticks + 1
    if left > 0 then
      left = left - 1
      return "running"
    end
    left = duration
    return "success"
  end
end

local function make_sequence_node(children)
  local current = 1
  return function()
    ticks = ticks + 1
    while true do
      if current > #children then
        current = 1
        return "success"
      end
      local status = children[current]()
      if status == "running" then
        return "running"
      elseif status == "failure" then
        current = 1
        return "failure"
      end
      current = current + 1
    end
  end
end

local function make_fallback_node(children)
  return function()
    ticks = ticks + 1
    for i = 1, #children do
      local status = children[i]()
      if status ~= "failure" then
        return status
      end
    end
    return "failure"
  end
end

local function make_parallel_node(children)
  return function()
    ticks = ticks + 1
    local succeeded, failed = 0, 0
    for i = 1, #children do
      local status = children[i]()
      if status == "success" then
        succeeded = succeeded + 1
      elseif status == "failure" then
        failed = failed + 1
      end
    end
    if 2 * failed > #children then
      return "failure"
    elseif 2 * succeeded > #children then
      return "success"
    end
    return "running"
  end
end

local function make_leaf()
  if next_random(2) == 0 then
    return make_condition_node(2 + next_random(9))
  end
  return make_action_node(next_random(3))
end

-- Returns a tree of `size` nodes.
local function make_tree(size)
  if size == 1 then
    return make_leaf()
  end
  local count = math.min(6, size - 1)
  local children = {}
  local share = floor((size - 1) / count)
  for i = 1, count do
    children[i] = make_tree(i == 1 and size - 1 - share * (count - 1) or share)
  end
  local kind = next_random(4)
  if kind == 0 then
    return make_sequence_node(children)
  elseif kind == 1 then
    return make_fallback_node(children)
  end
  return make_parallel_node(children)
end

local tree = make_tree(10000)
local succeeded, failed = 0, 0
for i = 0, 11999 do
  clock = i
  local status = tree()
  if status == "success" then
    succeeded = succeeded + 1
  elseif status == "failure" then
    failed = failed + 1
  end
end
print(string.format("%d %d %d", succeeded, failed, ticks))
