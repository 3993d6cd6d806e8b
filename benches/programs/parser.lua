-- parser: a recursive-descent parser of arithmetic, and an evaluator of the trees that it makes.

local seed = 42

local function next_random(limit)
  seed = (seed * 16807) % 2147483647
  return seed % limit
end

local function write_expression(depth, out)
  if depth == 0 or next_random(5) == 0 then
    out[#out + 1] = next_random(1000)
  else
    out[#out + 1] = "("
    write_expression(depth - 1, out)
    local operator = next_random(3) + 1
    out[#out + 1] = ("+-*"):sub(operator, operator)
    write_expression(depth - 1, out)
    out[#out + 1] = ")"
  end
end

local text, position = "", 1

local function peek()
  return text:byte(position)
end

local OPEN, PLUS, MINUS, TIMES = ("(+-*"):byte(1, 4)
local ZERO, NINE = ("09"):byte(1, 2)
local parse_sum

local function parse_number()
  local value = 0
  local character = peek()
  while character and character >= ZERO and character <= NINE do
    value = value * 10 + (character - ZERO)
    position = position + 1
    character = peek()
  end
  return value
end

local function parse_factor()
  if peek() == OPEN then
    position = position + 1
    local value = parse_sum()
    position = position + 1
    return value
  end
  return parse_number()
end

local function parse_product()
  local left = parse_factor()
  while peek() == TIMES do
    position = position + 1
    left = { "*", left, parse_factor() }
  end
  return left
end

function parse_sum()
  local left = parse_product()
  local operator = peek()
  while operator == PLUS or operator == MINUS do
    position = position + 1
    left = { operator == PLUS and "+" or "-", left, parse_product() }
    operator = peek()
  end
  return left
end

local function evaluate(tree)
  if type(tree) ~= "table" then
    return tree
  end
  local left, right = evaluate(tree[2]), evaluate(tree[3])
  local operator = tree[1]
  if operator == "+" then
    return (left + right) % 1000003
  elseif operator == "-" then
    return (left - right) % 1000003
  end
  return (left * right) % 1000003
end

for _ = 1, 400 do
  local out = {}
  write_expression(14, out)
  text, position = table.concat(out), 1
  local tree = parse_sum()
  print(string.format("%d %d %d", #text, position - 1, evaluate(tree)))
end
