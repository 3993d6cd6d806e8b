-- text_statistics: the words of a text, how often they occur, and the most frequent ones.

local seed = 42

local function next_random(limit)
  seed = (seed * 16807) % 2147483647
  return seed % limit
end

local SYLLABLES = { "ro", "ver", "na", "vi", "ga", "tor", "el", "li", "ma", "se", "ta", "po" }

local function make_vocabulary(count)
  local words = {}
  for i = 1, count do
    local word = ""
    for _ = 1, 1 + next_random(4) do
      word = word .. SYLLABLES[next_random(12) + 1]
    end
    words[i] = word
  end
  return words
end

local function make_text(count, vocabulary)
  local out = {}
  for i = 0, count - 1 do
    local word = vocabulary[math.min(next_random(#vocabulary), next_random(#vocabulary)) + 1]
    out[#out + 1] = i % 13 == 0 and word:sub(1, 1):upper() .. word:sub(2) or word
    out[#out + 1] = i % 13 == 12 and ". " or " "
  end
  return table.concat(out)
end

-- Returns the words in lower case, in their order.
local function words_of(text)
  local words = {}
  for word in text:gmatch("%a+") do
    words[#words + 1] = word:lower()
  end
  return words
end

local function frequencies(words)
  local counts, different = {}, 0
  for _, word in ipairs(words) do
    if not counts[word] then
      different = different + 1
    end
    counts[word] = (counts[word] or 0) + 1
  end
  return counts, different
end

local function most_frequent(counts)
  local rows = {}
  for word, times in pairs(counts) do
    rows[#rows + 1] = { word = word, times = times }
  end
  table.sort(rows, function(a, b)
    return a.times > b.times or a.times == b.times and a.word < b.word
  end)
  return rows
end

local vocabulary = make_vocabulary(3000)
for _ = 1, 32 do
  local words = words_of(make_text(40000, vocabulary))
  local counts, different = frequencies(words)
  print(string.format("%d words, %d different", #words, different))
  local rows = most_frequent(counts)
  for i = 1, 5 do
    print(rows[i].word .. " " .. rows[i].times)
  end
end
