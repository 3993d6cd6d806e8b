-- tak: calls with three arguments, one of them in tail position.

local function tak(x, y, z)
  if y < x then
    return tak(tak(x - 1, y, z), tak(y - 1, z, x), tak(z - 1, x, y))
  end
  return z
end

local total = 0
for i = 0, 23 do
  total = total + tak(24, 16, 8 + i % 2)
end
print(total)
