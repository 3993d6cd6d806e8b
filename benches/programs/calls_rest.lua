-- calls_rest: calls of a function that takes the rest of its arguments in a table.

local function volume(width, ...)
  local others = { ... }
  return width + others[1]
end

local sum = 0
for i = 0, 9999999 do
  sum = (sum + volume(i, 3)) % 65536
end
print(sum)
