# strings: building, searching, cutting, concatenating and comparing them, and reading their characters.

from io import StringIO


def number_list(count):
    out = StringIO()
    for i in range(count):
        out.write(str(i))
        out.write(",")
    return out.getvalue()


def count_occurrences(pattern, text):
    count = 0
    position = text.find(pattern)
    while position >= 0:
        count += 1
        position = text.find(pattern, position + 1)
    return count


def split(separator, text):
    fields = []
    start = 0
    end = text.find(separator)
    while end >= 0:
        fields.append(text[start:end])
        start = end + len(separator)
        end = text.find(separator, start)
    return fields


def count_palindromes(fields):
    count = 0
    for field in fields:
        left = 0
        right = len(field) - 1
        while left < right and field[left] == field[right]:
            left += 1
            right -= 1
        if left >= right:
            count += 1
    return count


def count_commas(text):
    count = 0
    for character in text:
        if character == ",":
            count += 1
    return count


def count_equal_neighbours(fields):
    count = 0
    previous = ""
    for field in fields:
        if "<" + previous + "0>" == "<" + field + ">":
            count += 1
        previous = field[:-1]
    return count


def main():
    for i in range(40):
        text = number_list(20000 + i)
        fields = split(",", text)
        print(
            len(text),
            count_occurrences("99", text),
            len(fields),
            count_palindromes(fields),
            count_commas(text),
            count_equal_neighbours(fields),
        )


main()
