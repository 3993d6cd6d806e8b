-- sequences_maphash: a function called with each entry of a table, first to read, then to change it.

local function map_entries(f, t)
  for key, value in pairs(t) do
    f(key, value)
  end
end

local function run(rounds, size)
  local t, sum = {}, 0
  for i = 0, size - 1 do
    t[i * 7] = i
  end
  for round = 1, rounds do
    map_entries(function(key, value) sum = (sum + key + value) % 1000003 end, t)
  end
  for round = 1, math.floor(rounds / 4) do
    map_entries(function(key, value) t[key] = value + 1 end, t)
  end
  map_entries(function(key, value) sum = (sum + value) % 1000003 end, t)
  print(sum)
end

run(6000, 1000)
