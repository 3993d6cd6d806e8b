-- failure_call: the work common to all failure programs: a loop, a call, a sum.

local function operate(x)
  if x < 0 then error("negative") end
  return x
end

local sum = 0
for i = 0, 4999999 do
  sum = (sum + operate(i)) % 1000003
end
print(sum)
