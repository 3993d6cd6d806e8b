-- hash_tables: counting and looking up, with integers and then with strings as keys.

local seed = 42

local function next_random()
  seed = seed * 16807 % 2147483647
  return seed
end

local function count_integers(rounds)
  local counts = {}
  for _ = 1, rounds do
    local key = 97 * (next_random() % 50000)
    counts[key] = (counts[key] or 0) + 1
  end
  local found, sum = 0, 0
  for i = 0, rounds - 1 do
    local count = counts[i]
    if count then
      found = found + 1
      sum = sum + count
    end
  end
  print(found .. " " .. sum)
end

local function count_strings(rounds)
  local words, counts = {}, {}
  for i = 0, 19999 do
    words[i + 1] = string.format("word-%d", i)
  end
  for _ = 1, rounds do
    local word = words[next_random() % 10000 + 1]
    counts[word] = (counts[word] or 0) + 1
  end
  local sum = 0
  for i = 1, #words do
    local count = counts[words[i]]
    if count then
      sum = (sum * 31 + count) % 1000003
    end
  end
  print(sum)
end

count_integers(4000000)
count_strings(4000000)
