-- matrix: products of square matrices of floats.

local function make_matrix(size, seed)
  local matrix = {}
  for i = 0, size - 1 do
    local row = {}
    for j = 0, size - 1 do
      row[j + 1] = ((i * seed + j * j + seed) % 97) / 97.0
    end
    matrix[i + 1] = row
  end
  return matrix
end

local function multiply(a, b, size)
  local product = {}
  for i = 1, size do
    local row, of_a = {}, a[i]
    for j = 1, size do
      local sum = 0.0
      for k = 1, size do
        sum = sum + of_a[k] * b[k][j]
      end
      row[j] = sum
    end
    product[i] = row
  end
  return product
end

local function trace_of(matrix, size)
  local sum = 0.0
  for i = 1, size do
    sum = sum + matrix[i][i]
  end
  return sum
end

local size = 270
local a, b = make_matrix(size, 3), make_matrix(size, 7)
local product = multiply(a, b, size)
print(string.format("%d", math.floor(1000.0 * trace_of(product, size))))
print(string.format("%d", math.floor(trace_of(multiply(product, a, size), size))))
