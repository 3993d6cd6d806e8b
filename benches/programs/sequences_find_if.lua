-- sequences_find_if: the first element that satisfies a predicate, directly or after a key function.

local function find_if(predicate, list)
  for i = 1, #list do
    local item = list[i]
    if predicate(item) then
      return item
    end
  end
end

local function find_if_key(predicate, list, first, last, key)
  for i = first, last do
    local item = list[i]
    if predicate(key(item)) then
      return item
    end
  end
end

local function increment(x)
  return x + 1
end

local function run(rounds, size)
  local list, vector, sum = {}, {}, 0
  for i = 1, size do
    list[i] = i - 1
    vector[i] = i - 1
  end
  for round = 0, rounds - 1 do
    local wanted = size - 1 - round % 10
    sum = (sum + find_if(function(x) return x == wanted end, list)
           + find_if_key(function(x) return x > wanted end, vector, 1, size, increment)) % 1000003
  end
  print(sum)
end

run(9000, 1000)
