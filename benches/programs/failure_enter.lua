-- failure_enter: entering a protected call that does not fail.

local function operate(x)
  if x < 0 then error({ cause = "negative", x = x }) end
  return x
end

local sum = 0
for i = 0, 4999999 do
  local ok, value = pcall(operate, i)
  if not ok then
    if value.cause ~= "negative" then error(value) end
    value = 0
  end
  sum = (sum + value) % 1000003
end
print(sum)
