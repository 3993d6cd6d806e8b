-- nbody: float arithmetic on objects with mutable fields.

local sqrt, floor = math.sqrt, math.floor

local function make_bodies()
  local pi_value = 3.141592653589793
  local solar_mass = 4.0 * pi_value * pi_value
  local days = 365.24
  return {
    { x = 0.0, y = 0.0, z = 0.0, vx = 0.0, vy = 0.0, vz = 0.0, mass = solar_mass },
    {
      x = 4.84143144246472090,
      y = -1.16032004402742839,
      z = -0.103622044471123109,
      vx = 0.00166007664274403694 * days,
      vy = 0.00769901118419740425 * days,
      vz = -0.0000690460016972063023 * days,
      mass = 0.000954791938424326609 * solar_mass,
    },
    {
      x = 8.34336671824457987,
      y = 4.12479856412430479,
      z = -0.403523417114321381,
      vx = -0.00276742510726411010 * days,
      vy = 0.00499852801234917238 * days,
      vz = 0.0000230417297573763929 * days,
      mass = 0.000285885980666130812 * solar_mass,
    },
    {
      x = 12.8943695621391310,
      y = -15.1111514016986312,
      z = -0.223307578892655734,
      vx = 0.00296460137564761618 * days,
      vy = 0.00237847173959480950 * days,
      vz = -0.0000296589568540237556 * days,
      mass = 0.0000436624404335156298 * solar_mass,
    },
    {
      x = 15.3796971148509165,
      y = -25.9193146099879641,
      z = 0.179258772950371181,
      vx = 0.00268067772490389322 * days,
      vy = 0.00162824170038242295 * days,
      vz = -0.0000951592254519715870 * days,
      mass = 0.0000515138902046611451 * solar_mass,
    },
  }
end

local function offset_momentum(bodies)
  local sun = bodies[1]
  local px, py, pz = 0.0, 0.0, 0.0
  for i = 1, #bodies do
    local b = bodies[i]
    local mass = b.mass
    px = px + b.vx * mass
    py = py + b.vy * mass
    pz = pz + b.vz * mass
  end
  sun.vx = -px / sun.mass
  sun.vy = -py / sun.mass
  sun.vz = -pz / sun.mass
end

local function advance(bodies, dt)
  local count = #bodies
  for i = 1, count do
    local a = bodies[i]
    local ax, ay, az, a_mass = a.x, a.y, a.z, a.mass
    for j = i + 1, count do
      local b = bodies[j]
      local dx, dy, dz = ax - b.x, ay - b.y, az - b.z
      local d2 = dx * dx + dy * dy + dz * dz
      local magnitude = dt / (d2 * sqrt(d2))
      local a_pull = b.mass * magnitude
      local b_pull = a_mass * magnitude
      a.vx = a.vx - dx * a_pull
      a.vy = a.vy - dy * a_pull
      a.vz = a.vz - dz * a_pull
      b.vx = b.vx + dx * b_pull
      b.vy = b.vy + dy * b_pull
      b.vz = b.vz + dz * b_pull
    end
  end
  for i = 1, count do
    local b = bodies[i]
    b.x = b.x + dt * b.vx
    b.y = b.y + dt * b.vy
    b.z = b.z + dt * b.vz
  end
end

local function energy(bodies)
  local total = 0.0
  local count = #bodies
  for i = 1, count do
    local a = bodies[i]
    local vx, vy, vz = a.vx, a.vy, a.vz
    total = total + 0.5 * a.mass * (vx * vx + vy * vy + vz * vz)
    for j = i + 1, count do
      local b = bodies[j]
      local dx, dy, dz = a.x - b.x, a.y - b.y, a.z - b.z
      total = total - a.mass * b.mass / sqrt(dx * dx + dy * dy + dz * dz)
    end
  end
  return total
end

local bodies = make_bodies()
offset_momentum(bodies)
print(floor(energy(bodies) * 1000000000.0))
for _ = 1, 300000 do
  advance(bodies, 0.01)
end
print(floor(energy(bodies) * 1000000000.0))
