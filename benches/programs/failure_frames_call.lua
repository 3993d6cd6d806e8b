-- failure_frames_call: failure_frames without the failures: calls a hundred deep.

local function descend(depth, x)
  if depth == 0 then
    if x < 0 then error("negative") end
    return x
  end
  return 1 + descend(depth - 1, x)
end

local sum = 0
for i = 0, 199999 do
  sum = (sum + descend(100, i)) % 1000003
end
print(sum)
