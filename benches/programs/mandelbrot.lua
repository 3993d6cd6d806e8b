-- mandelbrot: float arithmetic in local variables, in the innermost of three loops.

local function escape_time(cr, ci, limit)
  local zr, zi = 0.0, 0.0
  local n = 0
  while n ~= limit and zr * zr + zi * zi <= 4.0 do
    zr, zi = zr * zr - zi * zi + cr, 2.0 * zr * zi + ci
    n = n + 1
  end
  return n
end

local function mandelbrot(size, limit)
  local inside, steps = 0, 0
  for y = 0, size - 1 do
    local ci = 2.0 * y / size - 1.0
    for x = 0, size - 1 do
      local n = escape_time(2.0 * x / size - 1.5, ci, limit)
      steps = steps + n
      if n == limit then
        inside = inside + 1
      end
    end
  end
  print(inside .. " " .. steps)
end

mandelbrot(800, 50)
