-- task_net: two coroutines run alternately to their ends, two hundred thousand times.
local sum = 0
for i = 0, 199999 do
  local a = coroutine.create(function() return i end)
  local b = coroutine.create(function() return 1 end)
  local _, x = coroutine.resume(a)
  local _, y = coroutine.resume(b)
  sum = sum + x + y
end
print(sum)
