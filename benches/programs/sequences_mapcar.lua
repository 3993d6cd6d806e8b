-- sequences_mapcar: a function mapped over one array and over two.

local function map(f, list)
  local result = {}
  for i = 1, #list do
    result[i] = f(list[i])
  end
  return result
end

local function map2(f, a, b)
  local result = {}
  for i = 1, math.min(#a, #b) do
    result[i] = f(a[i], b[i])
  end
  return result
end

local function run(rounds, size)
  local list, sum = {}, 0
  for i = 1, size do
    list[i] = size - i
  end
  for round = 0, rounds - 1 do
    local squares = map(function(x) return x * x end, list)
    local sums = map2(function(x, y) return x + y + round end, list, squares)
    sum = (sum + sums[1]) % 1000003
  end
  print(sum)
end

run(6000, 1000)
