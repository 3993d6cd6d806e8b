-- neural_network: a network with one hidden layer learns the parity of four bits.

local INPUTS = 4
local HIDDEN = 12

local exp, floor = math.exp, math.floor
local seed = 42

local function random_weight()
  seed = (seed * 16807) % 2147483647
  return (seed % 2000) / 1000.0 - 1.0
end

local function random_weights(count)
  local weights = {}
  for i = 1, count do
    weights[i] = random_weight()
  end
  return weights
end

local function sigmoid(x)
  return 1.0 / (1.0 + exp(-x))
end

local function make_network()
  local first = {}
  for i = 1, HIDDEN do
    first[i] = random_weights(INPUTS + 1)
  end
  return { first_layer = first, second_layer = random_weights(HIDDEN + 1), activations = {} }
end

local function answer(network, inputs)
  local activations, second = network.activations, network.second_layer
  for i = 1, HIDDEN do
    local weights = network.first_layer[i]
    local sum = weights[INPUTS + 1]
    for j = 1, INPUTS do
      sum = sum + weights[j] * inputs[j]
    end
    activations[i] = sigmoid(sum)
  end
  local sum = second[HIDDEN + 1]
  for i = 1, HIDDEN do
    sum = sum + second[i] * activations[i]
  end
  return sigmoid(sum)
end

-- Corrects the weights for one example; returns the square of the error.
local function learn(network, inputs, target, rate)
  local given = answer(network, inputs)
  local difference = target - given
  local delta = difference * given * (1.0 - given)
  local activations, second = network.activations, network.second_layer
  for i = 1, HIDDEN do
    local activation = activations[i]
    local below = delta * second[i] * activation * (1.0 - activation)
    local weights = network.first_layer[i]
    for j = 1, INPUTS do
      weights[j] = weights[j] + rate * below * inputs[j]
    end
    weights[INPUTS + 1] = weights[INPUTS + 1] + rate * below
    second[i] = second[i] + rate * delta * activation
  end
  second[HIDDEN + 1] = second[HIDDEN + 1] + rate * delta
  return difference * difference
end

local function bit(number, place)
  return floor(number / 2 ^ place) % 2
end

local function example(number)
  local inputs = {}
  for i = 0, INPUTS - 1 do
    inputs[i + 1] = bit(number, i) == 1 and 1.0 or 0.0
  end
  return inputs
end

local function parity(number)
  local count = 0
  for i = 0, INPUTS - 1 do
    count = count + bit(number, i)
  end
  return count % 2 == 1 and 1.0 or 0.0
end

local network = make_network()
local examples = {}
for i = 0, 15 do
  examples[i] = example(i)
end
for i = 0, 11999 do
  local sum = 0.0
  for j = 0, 15 do
    sum = sum + learn(network, examples[j], parity(j), 0.5)
  end
  if i % 2000 == 0 then
    print(string.format("%d %d", i, floor(10000.0 * sum)))
  end
end
local line = {}
for i = 0, 15 do
  line[#line + 1] = string.format("%d", floor(answer(network, examples[i]) + 0.5))
end
print(table.concat(line))
