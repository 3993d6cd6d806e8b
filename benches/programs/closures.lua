-- closures: creating them, calling them, and assigning to captured variables.

local function make_adder(n)
  return function(x) return x + n end
end

local function make_accumulator(total)
  return function(amount)
    total = (total + amount) % 1000003
    return total
  end
end

local function compose(f, g)
  return function(x) return f(g(x)) end
end

local shared = make_accumulator(1)
local checksum = 0
for i = 0, 1599999 do
  local own = make_accumulator(i)
  local both = compose(make_adder(i), own)
  own(7)
  shared(both(11))
  checksum = (checksum + both(13)) % 1000003
end
print(checksum .. " " .. shared(0))
