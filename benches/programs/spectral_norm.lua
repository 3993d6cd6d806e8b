-- spectral_norm: float arithmetic on vectors, with a call for every element of a matrix.

local function matrix_element(i, j)
  local ij = i + j
  return 1.0 / (ij * (ij + 1) * 0.5 + i + 1)
end

local function multiply_av(n, v, av)
  for i = 1, n do
    local sum = 0.0
    for j = 1, n do
      sum = sum + matrix_element(i - 1, j - 1) * v[j]
    end
    av[i] = sum
  end
end

local function multiply_atv(n, v, atv)
  for i = 1, n do
    local sum = 0.0
    for j = 1, n do
      sum = sum + matrix_element(j - 1, i - 1) * v[j]
    end
    atv[i] = sum
  end
end

local function multiply_atav(n, v, result, scratch)
  multiply_av(n, v, scratch)
  multiply_atv(n, scratch, result)
end

local function spectral_norm(n)
  local u, v, scratch = {}, {}, {}
  for i = 1, n do
    u[i], v[i], scratch[i] = 1.0, 0.0, 0.0
  end
  for _ = 1, 10 do
    multiply_atav(n, u, v, scratch)
    multiply_atav(n, v, u, scratch)
  end
  local vbv, vv = 0.0, 0.0
  for i = 1, n do
    vbv = vbv + u[i] * v[i]
    vv = vv + v[i] * v[i]
  end
  return math.sqrt(vbv / vv)
end

print(math.floor(spectral_norm(640) * 1000000000.0))
