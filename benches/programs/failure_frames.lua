-- failure_frames: an error a hundred calls inside the protected call.

local function descend(depth, x)
  if depth == 0 then
    error({ cause = "broken", x = x })
  end
  return 1 + descend(depth - 1, x)
end

local sum = 0
for i = 0, 199999 do
  local ok, value = pcall(descend, 100, i)
  if not ok then
    if value.cause ~= "broken" then error(value) end
    value = value.x + 1
  end
  sum = (sum + value) % 1000003
end
print(sum)
