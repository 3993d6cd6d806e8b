// task_spawn_many: a hundred thousand goroutines created, then all awaited.
package main

import "fmt"

func main() {
	values := make([]chan int, 100000)
	for i := range values {
		done := make(chan int, 1)
		values[i] = done
		i := i
		go func() { done <- i + 1 }()
	}
	sum := 0
	for _, done := range values {
		sum += <-done
	}
	fmt.Println(sum)
}
