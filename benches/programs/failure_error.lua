-- failure_error: an error with a text, caught by a protected call.

local function operate(x)
  if x < 0 then return x end
  error("not negative")
end

local sum = 0
for i = 0, 999999 do
  local ok, value = pcall(operate, i)
  if not ok then
    value = i + 1
  end
  sum = (sum + value) % 1000003
end
print(sum)
