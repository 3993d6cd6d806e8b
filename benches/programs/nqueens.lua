-- nqueens: building and walking short lists that share their tails.

local function is_safe(row, placed)
  local distance = 1
  while placed do
    local other = placed.first
    if other == row or other == row + distance or other == row - distance then
      return false
    end
    distance = distance + 1
    placed = placed.rest
  end
  return true
end

local function place_queens(size, column, placed, solutions)
  if column == size then
    return { first = placed, rest = solutions }
  end
  for row = 0, size - 1 do
    if is_safe(row, placed) then
      solutions = place_queens(size, column + 1, { first = row, rest = placed }, solutions)
    end
  end
  return solutions
end

local function weigh(placed)
  local weight, column = 0, 0
  while placed do
    column = column + 1
    weight = weight + column * placed.first
    placed = placed.rest
  end
  return weight
end

local function nqueens(size)
  local solutions = place_queens(size, 0, nil, nil)
  local count, checksum = 0, 0
  while solutions do
    checksum = (checksum * 31 + weigh(solutions.first)) % 1000003
    count = count + 1
    solutions = solutions.rest
  end
  print(count .. " " .. checksum)
end

for size = 7, 11 do
  nqueens(size)
end
nqueens(11)
