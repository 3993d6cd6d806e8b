-- hash_tables_dense: tables whose keys are all integers of a range, entered in order or at random, looked up
-- in order and at random.

local seed = 42

local function next_random(limit)
  seed = seed * 16807 % 2147483647
  return seed % limit
end

local function squares(count)
  local t = {}
  for i = 0, count - 1 do
    t[i] = i * i % 1009
  end
  return t
end

local function scattered(count)
  local t = {}
  local key = 0
  for i = 0, count - 1 do
    t[key + 1] = i
    key = (key + 7919) % count
  end
  return t
end

local function sum_in_order(t, count, rounds)
  local sum = 0
  for _ = 1, rounds do
    for i = 0, count - 1 do
      sum = sum + (t[i + 1] or 0)
    end
  end
  return sum
end

local function sum_at_random(t, count, lookups)
  local sum = 0
  for _ = 1, lookups do
    sum = sum + (t[next_random(count)] or 0)
  end
  return sum
end

for _, count in ipairs({ 1000, 100000 }) do
  local rounds = math.floor(4000000 / count)
  for _, t in ipairs({ squares(count), scattered(count) }) do
    print(string.format("%d %d", sum_in_order(t, count, rounds), sum_at_random(t, count, 1000000)))
  end
end
