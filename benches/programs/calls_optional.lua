-- calls_optional: calls of a function with a parameter that is not given.

local function volume(width, height)
  height = height or 3
  return width + height
end

local sum = 0
for i = 0, 9999999 do
  sum = (sum + volume(i)) % 65536
end
print(sum)
