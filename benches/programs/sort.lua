-- sort: the library's sort of a vector, with a user-defined predicate.

local seed = 42

local function next_random()
  seed = seed * 16807 % 2147483647
  return seed
end

local function random_vector(size)
  local numbers = {}
  for i = 1, size do
    numbers[i] = next_random()
  end
  return numbers
end

local function checksum(numbers)
  local sum = 0
  for i = 1, #numbers do
    sum = (sum * 31 + numbers[i]) % 1000003
  end
  return sum
end

local function by_last_digits(a, b)
  local a_key, b_key = a % 1000, b % 1000
  if a_key == b_key then
    return a > b
  end
  return a_key < b_key
end

local numbers = random_vector(250000)
table.sort(numbers, function(a, b) return a < b end)
print(checksum(numbers))
table.sort(numbers, by_last_digits)
print(checksum(numbers))
table.sort(numbers, function(a, b) return a > b end)
print(checksum(numbers))
