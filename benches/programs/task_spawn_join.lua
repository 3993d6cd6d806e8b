-- task_spawn_join: a million coroutines, one after another, each created and run to its end.
local sum = 0
for i = 0, 999999 do
  local _, value = coroutine.resume(coroutine.create(function() return i end))
  sum = sum + value
end
print(sum)
