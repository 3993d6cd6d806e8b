-- failure_condition: an error of a class of the program's own, whose handler reads a field.

local Broken = {}
Broken.__index = Broken

local function broken(fields)
  return setmetatable({ part = fields.part, cost = fields.cost or 0 }, Broken)
end

local function operate(x)
  if x < 0 then return x end
  error(broken({ part = x, cost = 2 }))
end

local sum = 0
for i = 0, 999999 do
  local ok, value = pcall(operate, i)
  if not ok then
    if getmetatable(value) ~= Broken then error(value) end
    value = value.part + value.cost
  end
  sum = (sum + value) % 1000003
end
print(sum)
