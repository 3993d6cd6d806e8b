-- strings: building, searching, cutting, concatenating and comparing them, and reading their characters.

local COMMA = string.byte(",")

local function number_list(count)
  local out = {}
  for i = 0, count - 1 do
    out[#out + 1] = i
    out[#out + 1] = ","
  end
  return table.concat(out)
end

local function count_occurrences(pattern, text)
  local count = 0
  local position = text:find(pattern, 1, true)
  while position do
    count = count + 1
    position = text:find(pattern, position + 1, true)
  end
  return count
end

local function split(separator, text)
  local fields = {}
  local start = 1
  local stop = text:find(separator, start, true)
  while stop do
    fields[#fields + 1] = text:sub(start, stop - 1)
    start = stop + #separator
    stop = text:find(separator, start, true)
  end
  return fields
end

local function count_palindromes(fields)
  local count = 0
  for _, field in ipairs(fields) do
    local left, right = 1, #field
    while left < right and field:byte(left) == field:byte(right) do
      left = left + 1
      right = right - 1
    end
    if left >= right then
      count = count + 1
    end
  end
  return count
end

local function count_commas(text)
  local count = 0
  for i = 1, #text do
    if text:byte(i) == COMMA then
      count = count + 1
    end
  end
  return count
end

local function count_equal_neighbours(fields)
  local count = 0
  local previous = ""
  for _, field in ipairs(fields) do
    if "<" .. previous .. "0>" == "<" .. field .. ">" then
      count = count + 1
    end
    previous = field:sub(1, -2)
  end
  return count
end

for i = 0, 39 do
  local text = number_list(20000 + i)
  local fields = split(",", text)
  print(string.format(
    "%d %d %d %d %d %d",
    #text,
    count_occurrences("99", text),
    #fields,
    count_palindromes(fields),
    count_commas(text),
    count_equal_neighbours(fields)
  ))
end
