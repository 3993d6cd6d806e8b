; Colours. Of several patterns that match a node, the last one counts.

(comment) @comment
(block_comment) @comment
(interpreter) @keyword.directive
(string) @string
(character) @character
(number) @number
(bit_vector) @number
(keyword) @constant
(uninterned) @constant
(logical_variable) @variable.parameter
(symbol) @variable

((symbol) @variable.builtin
  (#match? @variable.builtin "^[*].+[*]$"))
((symbol) @constant.builtin
  (#match? @constant.builtin "^(nil|t|NIL|T)$"))

["(" ")"] @punctuation.bracket
["'" "`" "," ",@" ",." "#'" "#." "#+" "#-"] @operator

; Operators.
(list . (symbol) @function.call)
(function (symbol) @function)

((list . (symbol) @keyword)
  (#match? @keyword "^(let[*]?|flet|labels|macrolet|symbol-macrolet|if|when|unless|cond|[ec]?case|[ec]?typecase|progn|prog1|prog2|block|return|return-from|tagbody|go|catch|throw|loop|do[*]?|dolist|dotimes|lambda|setf|setq|incf|decf|push|pop|multiple-value-bind|destructuring-bind|and|or|not|the|quote|function|declare|in-package|require|eval-when|with-[a-z-]+)$"))

; Forms about failure.
((list . (symbol) @keyword.exception)
  (#match? @keyword.exception "^(fail|retry|abort|error|signal|with-recovery-procedures|with-cleanup-procedure|unwind-protect|handler-case|handler-bind|restart-case|ignore-errors|define-cause)$"))

; Forms about tasks.
((list . (symbol) @keyword.coroutine)
  (#match? @keyword.coroutine "^(spawn|task-net|or-parallel|try-all|pursue|try-in-order|partial-order|supervise|with-guardian|whenever|wait-until|wait-for-events|with-timeout|with-budget|with-quota|do-every|without-interrupts|with-resources?|with-maintained-propert(y|ies)|achieve|to-achieve|sleep)$"))

; Definitions.
((list . (symbol) @keyword.function . (symbol) @function)
  (#match? @keyword.function "^(def[a-z]+|define-[a-z-]+)$"))
((list . (symbol) @keyword.function . (list . (symbol) @function))
  (#match? @keyword.function "^(def[a-z]+|define-[a-z-]+)$"))
((list . (symbol) @keyword.function . (symbol) . (string) @string.documentation)
  (#match? @keyword.function "^(defpackage)$"))
((list . (symbol) @keyword.function . (symbol) . (list) . (string) @string.documentation)
  (#match? @keyword.function "^(defun|defmacro|defgeneric)$"))

; Parameters and bindings, which are not called.
((list . (symbol) @keyword.function . [(symbol) (list)] . (list (symbol) @variable.parameter))
  (#match? @keyword.function "^(defun|defmacro|defgeneric|define-mock|define-compiler-macro|deftype)$"))
((list . (symbol) @keyword.function . (symbol) . (list (list . (symbol) @variable.parameter)))
  (#match? @keyword.function "^(defun|defmacro|defmethod|define-mock)$"))
((list . (symbol) @keyword.function . (symbol) . (keyword) . (list (list . (symbol) @variable.parameter)))
  (#match? @keyword.function "^defmethod$"))
((list . (symbol) @keyword . (list (symbol) @variable.parameter))
  (#match? @keyword "^(lambda|multiple-value-bind|destructuring-bind)$"))
((list . (symbol) @keyword . (list (list . (symbol) @variable)))
  (#match? @keyword "^(let[*]?|do[*]?|symbol-macrolet)$"))
((list . (symbol) @keyword . (list . (symbol) @variable))
  (#match? @keyword "^(dolist|dotimes)$"))
