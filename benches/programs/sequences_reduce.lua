-- sequences_reduce: arrays folded with user-defined functions.

local function reduce(f, list, value)
  local first = 1
  if value == nil then
    value = list[1]
    first = 2
  end
  for i = first, #list do
    value = f(value, list[i])
  end
  return value
end

local function run(rounds, size)
  local list, vector, sum = {}, {}, 0
  for i = 1, size do
    list[i] = size - i
    vector[i] = i - 1
  end
  for round = 0, rounds - 1 do
    sum = (sum + reduce(function(a, b) return a + b end, list)
           + reduce(function(a, b) if b > a then return b else return a end end, vector, round)) % 1000003
  end
  print(sum)
end

run(8000, 1000)
