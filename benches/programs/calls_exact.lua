-- calls_exact: calls of a function of two parameters, both given.

local function volume(width, height)
  return width + height
end

local sum = 0
for i = 0, 9999999 do
  sum = (sum + volume(i, 3)) % 65536
end
print(sum)
