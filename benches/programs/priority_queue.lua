-- priority_queue: a binary heap with an order that its user gives, and a simulation with it.

local floor = math.floor

local function new_queue(before)
  return { items = {}, count = 0, before = before }
end

local function enqueue(queue, item)
  local items, before = queue.items, queue.before
  local place = queue.count
  queue.count = place + 1
  while true do
    local above = floor((place - 1) / 2)
    if place == 0 or not before(item, items[above]) then
      items[place] = item
      return item
    end
    items[place] = items[above]
    place = above
  end
end

local function dequeue(queue)
  local items, before = queue.items, queue.before
  local first = items[0]
  local count = queue.count - 1
  queue.count = count
  local last = items[count]
  local place = 0
  items[count] = nil
  while true do
    local below = 2 * place + 1
    if below >= count then
      break
    end
    if below + 1 < count and before(items[below + 1], items[below]) then
      below = below + 1
    end
    if not before(items[below], last) then
      break
    end
    items[place] = items[below]
    place = below
  end
  if count > 0 then
    items[place] = last
  end
  return first
end

local seed = 42

local function next_random(limit)
  seed = (seed * 16807) % 2147483647
  return seed % limit
end

local queue = new_queue(function(a, b)
  return a.time < b.time
end)
local counts = { [0] = 0, 0, 0, 0, 0 }
local now = 0
for i = 0, 1999 do
  enqueue(queue, { time = next_random(100000), kind = i % 5 })
end
for i = 0, 399999 do
  local arrival = dequeue(queue)
  now = arrival.time
  counts[arrival.kind] = counts[arrival.kind] + 1
  enqueue(queue, { time = now + 1 + next_random(100000), kind = (now + i) % 5 })
end
print(now .. " " .. queue.count)
for i = 0, 4 do
  print(counts[i])
end
