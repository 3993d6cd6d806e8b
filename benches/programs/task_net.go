// task_net: two goroutines run side by side and awaited, two hundred thousand times.
package main

import (
	"fmt"
	"sync"
)

func main() {
	sum := 0
	for i := 0; i < 200000; i++ {
		var both sync.WaitGroup
		both.Add(2)
		a, b := 0, 0
		go func() { a = i; both.Done() }()
		go func() { b = 1; both.Done() }()
		both.Wait()
		sum += a + b
	}
	fmt.Println(sum)
}
