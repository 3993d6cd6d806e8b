-- catch_throw: leaving nested calls early, to an inner or to an outer catch.

local function descend(depth, n)
  if depth > 0 then
    return 1 + descend(depth - 1, n)
  elseif n % 3 == 0 then
    error({ tag = "inner", value = n })
  elseif n % 3 == 1 then
    error({ tag = "outer", value = n })
  end
  return n
end

local function search_inner(n)
  local ok, result = pcall(descend, 4, n)
  if not ok then
    if result.tag ~= "inner" then
      error(result)
    end
    result = result.value
  end
  return 1 + result
end

local function search_outer(n)
  local ok, result = pcall(search_inner, n)
  if not ok then
    if result.tag ~= "outer" then
      error(result)
    end
    return result.value
  end
  return 2 + result
end

local checksum = 0
for n = 0, 1599999 do
  checksum = (checksum * 3 + search_outer(n)) % 1000003
end
print(checksum)
