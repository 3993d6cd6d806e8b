-- failure_handled: an error caught by the enclosing protected call, which returns a result.

local function operate(x)
  error({ cause = "broken", x = x })
end

local sum = 0
for i = 0, 999999 do
  local ok, value = pcall(operate, i)
  if not ok then
    if value.cause ~= "broken" then error(value) end
    value = value.x + 1
  end
  sum = (sum + value) % 1000003
end
print(sum)
