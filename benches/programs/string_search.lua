-- string_search: patterns in a text by the method of Horspool, with tables of skips.

local seed = 42

local function next_random(limit)
  seed = (seed * 16807) % 2147483647
  return seed % limit
end

local function random_text(length)
  local text = {}
  for i = 1, length do
    local letter = next_random(4) + 1
    text[i] = ("abcd"):sub(letter, letter)
  end
  return table.concat(text)
end

-- Returns how far the pattern moves, for each code of the character below its end.
local function skips(pattern)
  local length = #pattern
  local skips = {}
  for code = 0, 127 do
    skips[code] = length
  end
  for i = 1, length - 1 do
    skips[pattern:byte(i)] = length - i
  end
  return skips
end

local function count_matches(pattern, text)
  local skips = skips(pattern)
  local last = #pattern
  local count = 0
  local stop = last
  while stop <= #text do
    local i, j = last, stop
    while i >= 1 and pattern:byte(i) == text:byte(j) do
      i = i - 1
      j = j - 1
    end
    if i < 1 then
      count = count + 1
    end
    stop = stop + skips[text:byte(stop)]
  end
  return count
end

local text = random_text(300000)
for i = 0, 59 do
  local start = next_random(200000)
  local pattern = text:sub(start + 1, start + 3 + i % 6)
  print(pattern .. " " .. count_matches(pattern, text))
end
