-- task_broadcast: ten thousand coroutines that wait, all resumed a hundred times.
local woken, waiting = 0, {}
for i = 1, 10000 do
  waiting[i] = coroutine.create(function()
    for _ = 1, 100 do
      coroutine.yield()
      woken = woken + 1
    end
  end)
  coroutine.resume(waiting[i])
end
for _ = 1, 100 do
  for i = 1, 10000 do coroutine.resume(waiting[i]) end
end
print(woken)
