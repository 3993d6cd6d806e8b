" Colours of ESL, the Execution Support Language.
if exists("b:current_syntax")
  finish
endif

syntax case ignore
syntax match eslComment ";.*$" contains=@Spell
syntax region eslComment start="#|" end="|#" contains=eslComment,@Spell
syntax region eslString start=+"+ skip=+\\.+ end=+"+ contains=@Spell
syntax match eslCharacter "#\\\(\a\+\|.\)"
syntax match eslNumber "\(^\|[ \t('`,]\)\@<=[-+]\?\d\+\([./]\d\+\)\?\(e[-+]\?\d\+\)\?\ze\([ \t()]\|$\)"
syntax match eslKey "\(^\|[ \t('`]\)\@<=:[^ \t()'\"`;]\+"
syntax match eslVariable "#?[^ \t()'\"`;]*"
syntax match eslVariable "\(^\|[ \t(']\)\@<=?[^ \t()'\"`;]*"
syntax match eslSpecial "\*[^ \t()'\"`;]\+\*"
syntax match eslDefine "(\@<=\(def[a-z-]*\|define-[a-z-]*\)\>" nextgroup=eslName skipwhite
syntax match eslName "[^ \t()'\"`;]\+" contained
syntax match eslFailure "(\@<=\(fail\|retry\|abort\|error\|signal\|with-recovery-procedures\|with-cleanup-procedure\|unwind-protect\|handler-case\|handler-bind\|restart-case\|ignore-errors\)\ze[ \t\n()]"
syntax match eslTask "(\@<=\(spawn\|task-net\|or-parallel\|try-all\|pursue\|try-in-order\|partial-order\|supervise\|with-guardian\|whenever\|wait-until\|wait-for-events\|with-timeout\|with-budget\|with-quota\|do-every\|without-interrupts\|with-resources\?\|with-maintained-propert\(y\|ies\)\|achieve\|to-achieve\|sleep\)\ze[ \t\n()]"
syntax match eslForm "(\@<=\(let\*\?\|flet\|labels\|macrolet\|if\|when\|unless\|cond\|e\?case\|e\?typecase\|progn\|prog1\|block\|return\(-from\)\?\|loop\|do\*\?\|dolist\|dotimes\|lambda\|setf\|setq\|multiple-value-bind\|destructuring-bind\|and\|or\|not\|with-[a-z-]*\|in-package\|require\|quote\|function\|the\|is\)\ze[ \t\n()]"

highlight default link eslComment Comment
highlight default link eslString String
highlight default link eslCharacter Character
highlight default link eslNumber Number
highlight default link eslKey Constant
highlight default link eslVariable Identifier
highlight default link eslSpecial Identifier
highlight default link eslDefine Define
highlight default link eslName Function
highlight default link eslFailure Exception
highlight default link eslTask Repeat
highlight default link eslForm Statement

let b:current_syntax = "esl"
