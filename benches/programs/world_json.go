// world_json: fifty thousand lines of JSON, 10 MB, read into maps and slices.
package main

import (
	"encoding/json"
	"fmt"
)

func main() {
	line := []byte(`{"time": 12.5, "attitude": "turning", "battery": 68, "wheels": [1.25, -3.5, 0.125, 2.75], "status": {"mode": "nominal", "faults": [], "is_safe": false, "link": null}, "note": "all systems are nominal so far"}`)
	sum := 0
	for i := 0; i < 50000; i++ {
		var value map[string]any
		json.Unmarshal(line, &value)
		sum += int(value["battery"].(float64))
	}
	fmt.Println(sum)
}
