-- task_memory: a million coroutines that wait at the same time, then end.
local waiting = {}
for i = 1, 1000000 do
  waiting[i] = coroutine.create(function() return (coroutine.yield()) end)
  coroutine.resume(waiting[i])
end
local sum = 0
for i = 1, 1000000 do
  local _, value = coroutine.resume(waiting[i], 1)
  sum = sum + value
end
print(sum)
