-- task_ring: a thousand coroutines in a ring pass on a number, each adding one, a thousand times around.
local ring = {}
for i = 1, 1000 do
  ring[i] = coroutine.create(function(value)
    while true do value = coroutine.yield(value + 1) end
  end)
end
local value = 0
for _ = 1, 1000 do
  for i = 1, 1000 do
    local _
    _, value = coroutine.resume(ring[i], value)
  end
end
print(value)
