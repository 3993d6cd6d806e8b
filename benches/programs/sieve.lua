-- sieve: loops that read and write the elements of a long vector.

local function sieve(limit, prime)
  local count, sum = 0, 0
  for i = 2, limit do
    prime[i] = true
  end
  for i = 2, limit do
    if prime[i] then
      count = count + 1
      sum = sum + i
      for j = i * i, limit, i do
        prime[j] = false
      end
    end
  end
  print(count .. " " .. sum)
end

local prime = {}
for i = 1, 600000 do
  prime[i] = false
end
for i = 0, 39 do
  sieve(500000 + i * 2500, prime)
end
