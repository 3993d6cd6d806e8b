-- failure_retried: an error whose cause is repaired before the call is repeated.

broken = false

local function operate(x)
  if broken then error({ cause = "broken", x = x }) end
  return x
end

local sum = 0
for i = 0, 999999 do
  broken = true
  local ok, value
  repeat
    ok, value = pcall(operate, i)
    if not ok then
      if value.cause ~= "broken" then error(value) end
      broken = false
    end
  until ok
  sum = (sum + value) % 1000003
end
print(sum)
