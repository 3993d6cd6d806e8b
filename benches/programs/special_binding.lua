-- special_binding: binding global variables around calls, and reading them further down.

depth = 0
path = 1
checksum = 0

local function visit()
  checksum = (checksum * 3 + path) % 1000003
end

local function walk(levels)
  visit()
  if depth < levels then
    local saved_depth = depth
    depth = depth + 1
    local saved_path = path
    path = path * 2 % 1000003
    walk(levels)
    path = saved_path
    path = (path * 2 + 1) % 1000003
    walk(levels)
    path = saved_path
    depth = saved_depth
  end
end

for i = 0, 1 do
  walk(20 + i)
end
print(depth .. " " .. path .. " " .. checksum)
