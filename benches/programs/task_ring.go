// task_ring: a thousand goroutines in a ring pass on a number, each adding one, a thousand times around.
package main

import "fmt"

func main() {
	first := make(chan int)
	from := first
	for i := 0; i < 1000; i++ {
		source, target := from, make(chan int)
		go func() {
			for value := range source {
				target <- value + 1
			}
		}()
		from = target
	}
	value := 0
	for i := 0; i < 1000; i++ {
		first <- value
		value = <-from
	}
	fmt.Println(value)
}
