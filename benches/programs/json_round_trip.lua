-- json_round_trip: a reader and a writer of JSON. Objects are tables, arrays are tables with their length.

local text, position = "", 1

local QUOTE, COMMA, COLON, MINUS, SPACE, NEWLINE = ('",:- \n'):byte(1, 6)
local OPEN_ARRAY, CLOSE_ARRAY, OPEN_OBJECT, CLOSE_OBJECT = ("[]{}"):byte(1, 4)
local ZERO, NINE = ("09"):byte(1, 2)

local function peek()
  return text:byte(position)
end

local function skip_blanks()
  local character = peek()
  while character == SPACE or character == NEWLINE do
    position = position + 1
    character = peek()
  end
end

local read_value

local function read_text()
  local start = position + 1
  local stop = text:find('"', start, true)
  position = stop + 1
  return text:sub(start, stop - 1)
end

local function read_number()
  local start = position
  local character = peek()
  while character and (character >= ZERO and character <= NINE or character == MINUS) do
    position = position + 1
    character = peek()
  end
  return tonumber(text:sub(start, position - 1))
end

local function read_array()
  local items, count = {}, 0
  position = position + 1
  skip_blanks()
  while peek() ~= CLOSE_ARRAY do
    count = count + 1
    items[count] = read_value()
    skip_blanks()
    if peek() == COMMA then
      position = position + 1
      skip_blanks()
    end
  end
  position = position + 1
  return { is_array = true, count = count, items = items }
end

local function read_object()
  local object = {}
  position = position + 1
  skip_blanks()
  while peek() ~= CLOSE_OBJECT do
    local key = read_text()
    skip_blanks()
    position = position + 1
    object[key] = read_value()
    skip_blanks()
    if peek() == COMMA then
      position = position + 1
      skip_blanks()
    end
  end
  position = position + 1
  return object
end

function read_value()
  skip_blanks()
  local character = peek()
  if character == OPEN_OBJECT then
    return read_object()
  elseif character == OPEN_ARRAY then
    return read_array()
  elseif character == QUOTE then
    return read_text()
  end
  return read_number()
end

local KEYS = { "name", "x", "y", "tags", "battery" }

local function write_value(value, out)
  if type(value) == "string" then
    out[#out + 1] = '"'
    out[#out + 1] = value
    out[#out + 1] = '"'
  elseif type(value) == "number" then
    out[#out + 1] = value
  elseif value.is_array then
    out[#out + 1] = "["
    for i = 1, value.count do
      if i > 1 then
        out[#out + 1] = ","
      end
      write_value(value.items[i], out)
    end
    out[#out + 1] = "]"
  else
    out[#out + 1] = "{"
    local is_first = true
    for _, key in ipairs(KEYS) do
      local item = value[key]
      if item ~= nil then
        if not is_first then
          out[#out + 1] = ","
        end
        is_first = false
        write_value(key, out)
        out[#out + 1] = ":"
        write_value(item, out)
      end
    end
    out[#out + 1] = "}"
  end
end

local function sample(count)
  local out = { "[" }
  for i = 0, count - 1 do
    if i > 0 then
      out[#out + 1] = ", "
    end
    out[#out + 1] = string.format(
      '{"name": "rover-%d", "x": %d, "y": %d, "tags": ["a%d", "b", []], "battery": %d}',
      i, 3 * i, -i, i % 7, i * 31 % 100
    )
  end
  out[#out + 1] = "]"
  return table.concat(out)
end

local function round_trip(source)
  text, position = source, 1
  local out = {}
  write_value(read_value(), out)
  return table.concat(out)
end

local sampled = sample(2000)
print(#sampled)
for _ = 1, 24 do
  sampled = round_trip(sampled)
  print(#sampled .. " " .. sampled:sub(70001, 70040))
end
