-- sequences_sort: sorting with a user-defined predicate.

local seed = 42

local function next_random()
  seed = seed * 16807 % 2147483647
  return seed
end

local function sort_vectors(rounds, size)
  local sum = 0
  for round = 1, rounds do
    local vector = {}
    for i = 1, size do
      vector[i] = next_random()
    end
    table.sort(vector, function(a, b) return a > b end)
    sum = (sum + vector[math.floor(size / 2) + 1]) % 1000003
  end
  print(sum)
end

sort_vectors(10, 50000)
