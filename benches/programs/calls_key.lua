-- calls_key: calls of a function that takes named arguments in a table.

local function volume(width, options)
  return width + (options.height or 1)
end

local sum = 0
for i = 0, 9999999 do
  sum = (sum + volume(i, { height = 3 })) % 65536
end
print(sum)
