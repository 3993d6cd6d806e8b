-- task_ping_pong: two coroutines that pass each other a value a million times; the main program resumes them.
local ping, pong
local answer = coroutine.create(function()
  for _ = 1, 1000000 do
    pong = ping + 1
    coroutine.yield()
  end
end)
local ask = coroutine.create(function()
  pong = 0
  for _ = 1, 1000000 do
    ping = pong
    coroutine.yield()
  end
  return pong
end)
local result
for _ = 1, 1000000 do
  coroutine.resume(ask)
  coroutine.resume(answer)
end
_, result = coroutine.resume(ask)
print(result)
