-- simulation: vehicles on a ring road by the rules of Nagel and Schreckenberg, as records.

local CELLS = 2000
local LIMIT = 5

local seed = 42

local function next_random(limit)
  seed = (seed * 16807) % 2147483647
  return seed % limit
end

local function make_vehicles(count)
  local vehicles = {}
  for i = 0, count - 1 do
    vehicles[i + 1] = { position = i * math.floor(CELLS / count), speed = next_random(LIMIT), travelled = 0 }
  end
  return vehicles
end

local function gap(vehicle, ahead)
  return (ahead.position - vehicle.position - 1) % CELLS
end

local function choose_speed(vehicle, ahead)
  local speed = math.min(vehicle.speed + 1, LIMIT, gap(vehicle, ahead))
  if speed > 0 and next_random(4) == 0 then
    speed = speed - 1
  end
  vehicle.speed = speed
end

local function move(vehicle)
  vehicle.position = (vehicle.position + vehicle.speed) % CELLS
  vehicle.travelled = vehicle.travelled + vehicle.speed
end

local function step_all(vehicles)
  local count = #vehicles
  for i = 1, count do
    choose_speed(vehicles[i], vehicles[i % count + 1])
  end
  for i = 1, count do
    move(vehicles[i])
  end
end

local vehicles = make_vehicles(400)
for _ = 1, 5 do
  for _ = 1, 2000 do
    step_all(vehicles)
  end
  local travelled, standing = 0, 0
  for _, vehicle in ipairs(vehicles) do
    travelled = travelled + vehicle.travelled
    if vehicle.speed == 0 then
      standing = standing + 1
    end
  end
  print(travelled .. " " .. standing)
end
