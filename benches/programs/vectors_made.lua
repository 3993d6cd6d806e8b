-- vectors_made: many small tables, created with elements and filled.

local function run(rounds)
  local sum = 0
  for i = 0, rounds - 1 do
    local zeros = { 0, 0, 0, 0 }
    local pair = { 0, 0 }
    zeros[2] = i
    pair[1] = zeros
    sum = (sum + pair[1][2]) % 65536
  end
  print(sum)
end

run(4000000)
