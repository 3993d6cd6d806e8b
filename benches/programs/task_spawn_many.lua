-- task_spawn_many: a hundred thousand coroutines created, then all run to their end.
local tasks = {}
for i = 0, 99999 do tasks[#tasks + 1] = coroutine.create(function() return i + 1 end) end
local sum = 0
for _, task in ipairs(tasks) do
  local _, value = coroutine.resume(task)
  sum = sum + value
end
print(sum)
